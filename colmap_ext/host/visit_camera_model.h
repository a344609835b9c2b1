// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// COLMAP's camera models as types; separate from colmap.h, since they need
// Ceres.
#ifdef ADASFM_HOST_V4
#include "colmap_ext/host/v4/visit_camera_model.h"
#else
#include "colmap_ext/host/v3/visit_camera_model.h"
#endif
