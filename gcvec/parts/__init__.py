"""A large picture refined in parts: groups of its regions, each of which needs nothing of the others.

A coordinator holds the picture. In rounds it has every part refined, by whoever has time, and finds from what
the parts report how good each has to become next, so that points go where they buy most all over the picture.
"""
