"""Effects that an operator writes as formulas: the language, its parser, and the effect file."""
