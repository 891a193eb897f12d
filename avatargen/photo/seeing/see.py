"""see(picture) -> Sighting: the largest person in a photograph, by networks whose files are at hand."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from avatargen.errors import InputError
from avatargen.photo.models import DETECTOR, FACE, LANDMARKS, model_path
from avatargen.photo.picture import Picture
from avatargen.photo.seeing.detect import Found, find_people
from avatargen.photo.seeing.face import find_face
from avatargen.photo.seeing.matte import matte
from avatargen.photo.seeing.network import FileNetwork, Network
from avatargen.photo.seeing.pose import Landmarks, find_landmarks
from avatargen.photo.sighting import Sighting

LEAST_SCORE = 0.75  # of the landmark network, under which what is seen is no person
LEAST_SPAN = 60  # pixels of a person who can be told
TO_OURS = np.array([1.0, -1.0, -1.0])


@dataclass(frozen=True, kw_only=True, eq=False)
class Eyes:
    """The three networks."""

    detector: Network
    landmarks: Network
    face: Network


def open_eyes(folder: Path | None = None) -> Eyes:
    """Load the networks. Raises InputError where a file or the runtime is missing."""
    return Eyes(
        detector=FileNetwork(model_path(DETECTOR, folder)),
        landmarks=FileNetwork(model_path(LANDMARKS, folder)),
        face=FileNetwork(model_path(FACE, folder)),
    )


def see(picture: Picture, eyes: Eyes) -> Sighting:
    """The largest person.

    Raises:
        InputError: nobody is there, somebody is too small, or what is there looks like no person.
    """
    people = find_people(eyes.detector, picture.pixels)
    if not people:
        raise InputError(f"photo: found nobody in {picture.name}; give a photograph of one whole person")
    found = find_landmarks(eyes.landmarks, picture.pixels, people[0].square)
    check_person(picture, people, found)
    width, height = picture.size
    return Sighting(
        picture=picture,
        mask=matte(picture.pixels, found.cover(width, height)),
        pixels=found.pixels,
        metres=found.metres * TO_OURS,
        visibility=found.visibility,
        face=find_face(eyes.face, picture.pixels, found.pixels),
        people=len(people),
    )


def check_person(picture: Picture, people: list[Found], found: Landmarks) -> None:
    """Raises InputError where what was found is no person, or too small."""
    span = float(np.ptp(found.pixels, axis=0).max())
    if span < LEAST_SPAN:
        raise InputError(
            f"photo: the person in {picture.name} is {span:.0f} pixels tall; give one of {LEAST_SPAN} or more"
        )
    if found.score < LEAST_SCORE:
        raise InputError(
            f"photo: what {picture.name} shows does not look like a person ({found.score:.2f} of 1); give a "
            "photograph of one whole person"
        )
