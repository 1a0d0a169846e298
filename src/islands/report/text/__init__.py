"""Text for a terminal about results, diagnoses, inspections, plans and monitors."""
