"""From a text, or from phonemes with their times, to a mouth that says it.

text -> sounds (`spelling`) -> timed sounds (`timing`, `phoneme_file`) -> weights of visemes (`mouth`)
"""
