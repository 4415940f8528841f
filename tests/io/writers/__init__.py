"""Writers of scan files in odd but valid ways, by chance. They share no code with the readers of damageest."""
