"""Tenants of the service: keys, owners with their quotas, and webhooks with their deliveries."""
