"""The four methods that the paper is compared with (Table 1), each a model of pictures like AvatarGen's own.

    box_rays, ask -> volume rendering       volume.py
    z, label -> style                       baseline.py
    EG3D, StyleSDF, StyleNeRF, GIRAFFE-HD   eg3d.py, stylesdf.py, stylenerf.py, giraffe_hd.py

They know no body model: they work in the observed space, in a fixed box that the cameras look at, and are
told camera, pose and shape as numbers.
"""
