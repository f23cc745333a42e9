"""Opens notebooks (`exploring`), runs them (`running`, `processors`) and compares them (`agreement`, `testing`).

Nothing is imported here, because `exploring` must start on a bare Python.  What all notebooks need while they run
belongs in `running`.
"""
