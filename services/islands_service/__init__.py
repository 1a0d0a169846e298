"""The workshop: runs searches on more than one process."""
