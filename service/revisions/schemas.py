"""The JSON of edits."""

from __future__ import annotations

from typing import Annotated, Final

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from service.artifacts.description import LARGEST_NUMBER
from service.jobs.schemas import Color, job_path, whole
from worker.artifacts import EXPORTS, KINDS, REVISED

_MOST_CHANGES: Final = 10_000

Index = Annotated[int, Field(ge=0, le=LARGEST_NUMBER), BeforeValidator(whole)]
Shift = Annotated[float, Field(ge=-1e5, le=1e5, allow_inf_nan=False, description="pixels")]


class Move(BaseModel):
    """Move a control point of a boundary curve. Both patches beside it follow; junctions stay joined."""

    model_config = ConfigDict(extra="forbid", strict=True)

    curve: Index = Field(description="id of the curve in the patch description")
    index: Index = Field(description="which of its control points")
    dx: Shift
    dy: Shift


class Recolor(BaseModel):
    """Give a patch another colour; its shading stays."""

    model_config = ConfigDict(extra="forbid", strict=True)

    patch: Index = Field(description="id of the patch in the patch description")
    color: Color = Field(description="#rrggbb")


class Edits(BaseModel):
    """What is to change, and in which revision: 0 is the original."""

    model_config = ConfigDict(extra="forbid", strict=True)

    moves: list[Move] = Field(default=[], max_length=_MOST_CHANGES)
    recolors: list[Recolor] = Field(default=[], max_length=_MOST_CHANGES)
    revision: Index = Field(default=0, description="the revision that is edited; 0: the original")


class RevisionView(BaseModel):
    """A revision of a job's result and what can be asked for of it."""

    job: str
    revision: int
    links: dict[str, str]

    @classmethod
    def of(cls, job_id: str, revision: int) -> RevisionView:
        base = f"{job_path(job_id)}/revisions/{revision}"
        kinds = {name: KINDS[name] for name in REVISED} | EXPORTS
        links = {"self": base, "job": job_path(job_id)}
        links |= {name: f"{base}/{kind.route}" for name, kind in kinds.items()}
        return cls(job=job_id, revision=revision, links=links)
