"""How much diversity of contexts a translator needs: sets of clips that differ in it alone."""
