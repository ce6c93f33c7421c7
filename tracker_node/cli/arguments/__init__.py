"""Arguments and checks that several verbs share.

Begin with `recording`: how recording.yaml fills in what the command line leaves out.
"""
