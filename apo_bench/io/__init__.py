"""Files are read and written here, strictly and within limits, and processes started; knows nothing of assemblies."""
