"""The model beside the machine, row by row."""
