"""What a trial is asked for and what its row says: shared by all that makes rows and all that reads them."""
