"""What compiled functions share: how they are compiled and kept, pointers, bits, small linear systems."""
