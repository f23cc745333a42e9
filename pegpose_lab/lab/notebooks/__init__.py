"""Notebooks: opened (`exploring`), run (`running`, `processors`) and compared (`agreement`, `testing`).

Nothing is imported here, since `exploring` has to start on a bare Python.  What all notebooks need while
they run belongs into `running`.
"""
