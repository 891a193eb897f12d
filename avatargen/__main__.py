"""python -m avatargen: the command of that name."""

from avatargen.commands.main import program

if __name__ == "__main__":
    program()
