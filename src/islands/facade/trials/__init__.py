"""Small models that are compared before a search: kind of record, sampling rate and direct feedthrough."""
