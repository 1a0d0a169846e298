"""Choice of the preset `auto`: library, constraints and dead times, by trials and fits of several kinds."""
