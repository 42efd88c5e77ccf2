"""Randomised scenes of the rig's task, to pretrain on: the demonstration is the rig's, the look is anybody's.

Domain randomisation (Tobin et al. 2017): where every scene looks different, a clip of one's own is one more.
"""
