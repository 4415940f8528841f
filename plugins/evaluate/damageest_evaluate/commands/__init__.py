"""The command line of the evaluation, with one module per command. Heavy imports are inside the commands."""
