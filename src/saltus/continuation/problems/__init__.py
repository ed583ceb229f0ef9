"""Zero problems of each kind of solution, along one parameter and as a locus; borders that they meet."""
