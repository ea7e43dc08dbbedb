"""Reports that people read: one HTML page of result files, with everything in it and nothing from elsewhere.

A page holds its own style and script, is bound by a content security policy to these two, and opens from a disk.
Formulas are MathML. Figures are SVG made here, and not by matplotlib: they take their colors from the style of the
page, so that they change with light, dark and print; their letters are those of the page; 250 points of a curve are
4 kB and not 40, of which a page on a folder has hundreds; and the values that the pointer or the arrow keys show are
the samples themselves, which lie in the page as data. Of a folder, all reports are in one file, of which the browser
lays out the one that is looked at: a page that is moved or mailed is complete, and its links keep working.

Names, descriptions and paths are data: every text is escaped by the template, and what could turn a line around or
cannot be printed is replaced.
"""
