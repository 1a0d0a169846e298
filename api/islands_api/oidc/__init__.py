"""Bearer tokens of an OpenID Connect provider, as an alternative to keys. Read `token_verifier` first."""
