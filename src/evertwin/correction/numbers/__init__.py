"""The numbers of terms: fitted, where no slope leads too, and their intervals."""
