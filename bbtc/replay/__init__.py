"""Running exported trees in their engines, on scripted worlds: do they do what the simulation says?"""
