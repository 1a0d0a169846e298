"""HTML reports, and the process that renders figures. Read `identification_report` first."""
