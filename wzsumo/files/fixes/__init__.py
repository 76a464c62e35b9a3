"""Tables of fixes as other people write them: their files, their column names, their times and their coordinates."""
