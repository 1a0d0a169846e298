"""Checks before a job is stored: specification, file, inputs. Read `job_validation` first."""
