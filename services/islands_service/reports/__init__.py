"""The process that renders figures of jobs."""
