"""Islands on Ray: costs, benefits, limits, and equal results."""
