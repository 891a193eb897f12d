"""Tables 1 and 2 of the paper at our scale: methods and choices trained for the same pictures and measured
alike.

plan      which runs there are, and in which rows of which table each stands
worker    some of the runs, trained in turns in one process, then asked for pictures
conduct   the processes, the time, and what becomes of the runs of one that dies
packed    the pictures of all runs in a few small files, to be measured here or elsewhere
measured  the metrics of every run
tables    rows with intervals over seeds and people; sheet: the pictures side by side
"""
