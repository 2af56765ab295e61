"""A `command` model behind any Chat Completions address, from a build without network code: chat.py ADDRESS [VARIABLE WITH THE KEY]"""
import json, os, sys, urllib.error, urllib.request
asked = json.load(sys.stdin)
body = {name: int(x) if x == int(x) else x for name, x in asked["sampling"].items()}
body |= {"model": asked["model"], "messages": [{"role": m["role"], "content": m["text"]} for m in asked["messages"]]}
key = {"authorization": "Bearer " + os.environ[sys.argv[2]]} if sys.argv[2:] else {}
request = urllib.request.Request(sys.argv[1], json.dumps(body).encode(), {"content-type": "application/json", **key})
try:
    sys.stdout.write(json.load(urllib.request.urlopen(request, timeout=600))["choices"][0]["message"]["content"] or "")
except urllib.error.HTTPError as error:
    sys.exit(f"HTTP {error.code}: {error.read(400).decode(errors='replace')}")
