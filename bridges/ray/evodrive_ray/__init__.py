"""Does the shards of an EvoDrive run on a Ray cluster. The driver is `evodrive_ray.driver`."""
