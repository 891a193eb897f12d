"""A line of text to a person: what its words say of somebody, and the generator's person who is so.

text --items--> words with meanings --phrases--> mentions --wishes--> traits --person--> an avatar
"""
