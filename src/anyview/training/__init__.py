"""How networks are trained: what each is trained for, and the loop that they share."""
