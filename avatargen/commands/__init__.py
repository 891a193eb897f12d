"""The commands: programs, in which `assets` and `exporters` are ours whatever the current folder holds.

numpy's products are small here: more threads than one gain nothing, and once woken they spin on the cores
that the field and xatlas could use, a sixth of all processor time. numpy reads this as it is first imported.
"""

import os

from avatargen.shadow import prefer_ours

prefer_ours()
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
