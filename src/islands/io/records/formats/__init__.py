"""Readers of the file formats. Each one returns a `islands.io.records.table.Table`."""
