"""What tools/gen_proto.py is made of: the source read (source.py), and a module for each thing made from it."""
