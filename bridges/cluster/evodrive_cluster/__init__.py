"""Runs an EvoDrive study on a cluster. `conduct` holds the rounds, `on_ray` and `on_slurm` the two schedulers."""
