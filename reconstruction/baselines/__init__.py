"""What the reconstruction is compared with, given the same cameras and masks and nothing of the template."""
