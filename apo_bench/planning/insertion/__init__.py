"""How a part comes into its contacts: contact states, macros, ways of insertion."""
