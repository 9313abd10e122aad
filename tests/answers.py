"""What a verb answered, held to its schema, which here lets no key pass that it does not name."""

import json
from functools import cache
from typing import Any

import jsonschema

from gyrocal.json_schemas import schema
from gyrocal.present.output import _plain


def closed(part: Any) -> Any:
    """A schema that lets no key pass that it does not name, so that none is forgotten there."""
    if isinstance(part, list):
        return [closed(each) for each in part]
    if not isinstance(part, dict):
        return part
    found = {key: closed(value) for key, value in part.items()}
    return found | ({"additionalProperties": False} if isinstance(part.get("properties"), dict) else {})


@cache
def validators(verb: str) -> tuple[Any, ...]:
    """Of a verb's schema as it is, and closed."""
    return tuple(jsonschema.Draft202012Validator(each) for each in (schema(verb), closed(schema(verb))))


def check(verb: str, answer: Any) -> None:
    """Hold an answer, printed or as the verb's function returns it, to the verb's schema."""
    printed = json.loads(json.dumps(_plain(answer)))
    for validator in validators(verb):
        validator.validate(printed)
