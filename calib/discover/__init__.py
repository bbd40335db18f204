"""Discovery of missing physics on runs: what a run is asked, and what is said of the answer."""
