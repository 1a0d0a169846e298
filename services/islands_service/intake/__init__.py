"""Validation of jobs and files before they are stored. Read `job_validation` first."""
