import ctypes, json, sys, importlib.util
spec = importlib.util.spec_from_file_location('payload', 'i2ris/payload.py')
payload = importlib.util.module_from_spec(spec)
spec.loader.exec_module(payload)
table = json.loads(sys.argv[1])
seen = set()
for entry in table:
    kind = getattr(payload, entry['name'])
    assert kind.type_name() == entry['type_name'], entry['name']
    assert ctypes.sizeof(kind) == entry['size'], entry['name']
    names = [field['name'] for field in entry['fields']]
    assert [name for name, _ in kind._fields_] == names, entry['name']
    for field in entry['fields']:
        own = getattr(kind, field['name'])
        expected = field['offset'], field['bytes']
        assert (own.offset, own.size) == expected, (entry['name'], field)
    seen.add(entry['name'])
classes = {name for name, kind in vars(payload).items()
           if isinstance(kind, type) and issubclass(kind, payload.Payload)}
assert classes - {'Payload', 'SpanSummary'} == seen, classes ^ seen
