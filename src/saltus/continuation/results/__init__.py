"""Branches, loci, special points and what is made of them, as results with files and pictures."""
