"""The commands: programs, in which `assets` and `exporters` are ours whatever the current folder holds."""

from avatargen.shadow import prefer_ours

prefer_ours()
