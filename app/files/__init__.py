"""What lies on the disk: machines, runs, models, fits, poses and the site."""
