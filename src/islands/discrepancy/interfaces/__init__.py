"""Types that simulators and effects implement. Read `effect` and `simulator` first."""
