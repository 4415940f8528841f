"""The report as a PDF."""

# document.py: its pages
# book.py: what every page of it needs
# page_parts.py: styles, tables, drawings, numbered pages
# _budget.py: budgets of uncertainty as tables
# _sections.py: the sections of a result
