"""Choice of the preset `auto`: library, constraints and lags, by trials on the record."""
