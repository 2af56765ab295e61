"""MetaDrive as a backend of EvoDrive: a worker that answers rollout requests (see docs/BACKENDS.md)."""

BACKEND = "metadrive"
PROTOCOL = 1
