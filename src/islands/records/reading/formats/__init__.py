"""Readers of the file formats. Each one returns a `islands.records.reading.table.Table`."""
