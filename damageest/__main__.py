"""`python -m damageest`: the same as the command `damageest`, where that is not on the path."""

from damageest.cli import main

if __name__ == "__main__":
    main()
