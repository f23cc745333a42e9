"""The result on one page, ``figures/index.html``: claims, figures, tables and sliders, for a reader without a kernel.

`sliders` has the states that they move through, `figures` which figures are shown with which words, `build` the page; its look
and its script are ``page.css`` and ``page.js``.
"""

from .build import page_text, write_page

__all__ = ["page_text", "write_page"]
