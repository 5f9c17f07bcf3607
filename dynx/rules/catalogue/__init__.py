"""One rule a module, named for its id and its name: ``dx123_words_of_the_name.py``."""
