// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// COLMAP's classes, and functions for what its versions name or call
// differently. Code outside host/ includes COLMAP's headers only through this
// one. A folder host/vN has the functions for one version, and the sources that
// call that version's library; the headers of host/ are the same for all
// versions (docs/reference/host.md).
//
// Both folders' colmap.h have the same free functions:
//   MakeCamera, ModelIdOf, WidthOf, HeightOf (px), ParamsOf,
//   HasPriorFocalLength;
//   PlaneFromPixel, PixelFromPlane: from a pixel to the plane z = 1 of the
//     camera and back; where the camera model has no such point, NaN or a
//     point that does not map back;
//   XyOf, PointIdOf (observation), XyzOf, SetXyz, TrackOf, ErrorOf, SetError
//     (px), ColorOf (point);
//   CamFromWorld, SetCamFromWorld: of an image that is in a model;
//   IsRegistered, AddCamera, AddRegisteredImage, FilterPoints: of a model that
//     no HostMapper works on.
#ifdef ADASFM_HOST_V4
#include "colmap_ext/host/v4/colmap.h"
#else
#include "colmap_ext/host/v3/colmap.h"
#endif
