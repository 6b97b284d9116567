"""Reports: grading against the truth and the article, pages, pictures."""
