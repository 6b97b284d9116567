"""`psabench run` as the command line has it: what is offered, options, parsers, what each procedure prints."""
