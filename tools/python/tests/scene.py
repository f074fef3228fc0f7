"""Images of markers at known angles: a pinhole camera, blur, noise, uneven light. Shares nothing with the detector."""

import cv2
import numpy as np

OVERSAMPLING = 4


def image(marker_id, angle_deg, side_px, rng, *, size=(480, 640), tilt_deg=0.0, blur_px=1.0, noise=3.0,
            centre=None, ground=190.0, ink=40.0, distance=60.0):
    """A marker turned counter-clockwise by ``angle_deg`` in the image; ``tilt_deg`` out of its plane.

    ``distance`` is that of the camera in sides of the marker. The light falls off towards the corners.
    """
    rows, columns = size
    if centre is None:
        centre = (columns / 2 + rng.uniform(-20, 20), rows / 2 + rng.uniform(-20, 20))
    cells = 6
    art = cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_250), marker_id, cells, borderBits=1)
    art = np.pad(art, 1, constant_values=255)  # The white rim that a marker needs.
    art = cv2.resize(art, None, fx=64, fy=64, interpolation=cv2.INTER_NEAREST)
    half = 0.5 * side_px * (cells + 2) / cells
    angle, tilt = np.radians(angle_deg), np.radians(tilt_deg)
    corners = []
    for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
        # Turned about the line of sight, then tilted about the vertical.
        x, y = (u * np.cos(angle) + v * np.sin(angle)) * half, (v * np.cos(angle) - u * np.sin(angle)) * half
        x, z = x * np.cos(tilt), x * np.sin(tilt)
        scale = 1.0 / (1.0 + z / (distance * side_px))
        corners.append((centre[0] + x * scale, centre[1] + y * scale))
    last = art.shape[0] - 0.5
    from_art = np.float32([(-0.5, -0.5), (last, -0.5), (last, last), (-0.5, last)])
    fine = (np.array(corners) + 0.5) * OVERSAMPLING - 0.5
    warp = cv2.getPerspectiveTransform(from_art, np.float32(fine))
    shape = (columns * OVERSAMPLING, rows * OVERSAMPLING)
    paper = ink + art.astype(np.float32) / 255.0 * (225.0 - ink)
    canvas = cv2.warpPerspective(paper, warp, shape, flags=cv2.INTER_AREA, borderMode=cv2.BORDER_CONSTANT, borderValue=ground)
    canvas = cv2.resize(canvas, (columns, rows), interpolation=cv2.INTER_AREA)
    if blur_px > 0:
        canvas = cv2.GaussianBlur(canvas, (0, 0), blur_px)
    y, x = np.mgrid[-1:1:rows * 1j, -1:1:columns * 1j]
    canvas = canvas * (1.0 - 0.12 * (x**2 + y**2)) + rng.normal(0.0, noise, canvas.shape)
    return np.clip(canvas + 0.5, 0, 255).astype(np.uint8)
