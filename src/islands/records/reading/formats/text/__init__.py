"""Text tables: encoding, place of the header, cells, numbers. Read `text_table` first."""
