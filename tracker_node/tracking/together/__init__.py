"""Several bodies in the same images, tracked as one, and people who come and go. Begin with `bodies`."""
