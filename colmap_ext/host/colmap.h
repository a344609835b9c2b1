// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// COLMAP's classes, and what is named or called otherwise from version to
// version: the only way to a COLMAP header for what lies outside host/. A
// folder host/vN holds one version's form of it, and the sources that call its
// library; the headers of host/ are the same for all (docs/reference/host.md).
//
// Both folders' colmap.h have the same free functions:
//   MakeCamera, ModelIdOf, WidthOf, HeightOf (px), ParamsOf,
//   HasPriorFocalLength;
//   PlaneFromPixel, PixelFromPlane: from a pixel to the plane z = 1 of the
//     camera and back; NaN or a point that does not lead back where the
//     camera's model has no such point;
//   XyOf, PointIdOf (observation), XyzOf, SetXyz, TrackOf, ErrorOf, SetError
//     (px), ColorOf (point);
//   CamFromWorld, SetCamFromWorld: of an image that a model holds;
//   IsRegistered, AddCamera, AddRegisteredImage, FilterPoints: of a model that
//     no HostMapper works on.
#ifdef ADASFM_HOST_V4
#include "colmap_ext/host/v4/colmap.h"
#else
#include "colmap_ext/host/v3/colmap.h"
#endif
